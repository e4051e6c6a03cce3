"""The collapsed posterior: all that the force is linear in is integrated out; its modes."""
