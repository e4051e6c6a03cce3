"""A declared simulation as a chain of six stages: rig, shape, statics, friction, history, sensor."""
