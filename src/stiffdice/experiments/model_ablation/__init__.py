"""What each piece of the full model costs where a scene does not need it, and what leaving it out costs."""
