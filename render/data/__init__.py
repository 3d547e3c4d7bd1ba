"""What is drawn and how it is looked at: particles, camera, lights, finishes."""
