"""From a scene's words to the core's objects: yarns, layouts of weaves, sheets, bodies, garments."""
