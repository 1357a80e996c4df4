"""What dice tell: faces of many throws, by body, ground and steps."""
