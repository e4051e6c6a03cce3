"""The RUN folder: what a command leaves on disk, how it is resumed, kept or replaced, and read again."""
