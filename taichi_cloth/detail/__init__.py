"""What a camera needs of a fabric: blocks streamed, thinned out far away, refined down to the surface of a fibre."""
