"""Ways to move a sheet on (paper 3.2): one file a method, all with the interface of `base`."""
