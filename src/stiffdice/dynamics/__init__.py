"""Forces, energies, models and linear theory of a rigid cube on spring-damper ground."""
