"""A software splatter: particles and a camera in, images and video out. It knows nothing of cloth."""
