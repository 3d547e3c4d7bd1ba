"""Garments (paper 4): patterns, panels cut from cloth, sewn and worn."""
