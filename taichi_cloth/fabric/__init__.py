"""Fabric (paper 2.3 and 3.3): key points at the crossings, blocks of fibres between them, and fibres that follow."""
