"""What dice tell: faces of many throws, by body, shape, load, ground and steps; and what counts of faces say."""
