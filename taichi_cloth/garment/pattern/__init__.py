"""Patterns (paper 4): drafts, files of others, and cutting."""
