"""Patterns (paper 4): drafts, files of others, fitting to a body, and cutting."""
