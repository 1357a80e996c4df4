"""The physical problem: cube, ground and launch, validated."""
