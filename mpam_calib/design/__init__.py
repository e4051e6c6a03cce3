"""The design optimiser of the thesis's chapter 3: objectives, problems, search, optimality, sensitivity."""
