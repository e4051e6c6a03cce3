"""What a simulation gets wrong: misfit, named causes, the extended model and what it gains."""
