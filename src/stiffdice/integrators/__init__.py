"""Time-stepping schemes: one per module, and the batched kernel."""
