"""The force model's terms as pure functions of SI arrays, each with its equation number."""
