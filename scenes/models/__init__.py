"""From a scene to what it builds: one model a subject, all with the same few verbs."""
