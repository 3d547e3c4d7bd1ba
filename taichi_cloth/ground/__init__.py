"""What every room stands on: errors, arrays, the particle record, the runtime, memory, what is kept on disk."""
