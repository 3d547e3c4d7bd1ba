"""Where the program is stable and where it says no: starts, forces and numbers that no one would wish for."""
