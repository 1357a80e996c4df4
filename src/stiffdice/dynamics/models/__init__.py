"""Which motion is computed: one model per module."""
