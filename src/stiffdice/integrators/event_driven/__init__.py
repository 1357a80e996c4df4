"""The scheme that locates each change of contact and integrates between them."""
