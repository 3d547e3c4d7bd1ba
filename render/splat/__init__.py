"""The splatter: from particles and a camera to an image and its passes."""
