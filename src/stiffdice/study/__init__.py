"""Studies: a YAML file becomes a plan; what is done, and what is left."""
