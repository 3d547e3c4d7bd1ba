"""Pictures: linear light to the screen, files, video, words on them."""
