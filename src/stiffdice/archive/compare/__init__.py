"""What differs between two results, in numbers."""
