"""What stands behind and below the subject."""
