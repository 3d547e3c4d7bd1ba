"""Weaves (paper 2.3): drafts by name and from WIF files, colours, crimp and jamming of threads, a mill's ticket."""
