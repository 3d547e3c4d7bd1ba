"""From a model to pictures: cameras, streamed pieces, zooms."""
