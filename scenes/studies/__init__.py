"""What accuracy costs: a study a module, each of which gives rows of error and time, and one writer for them all."""
