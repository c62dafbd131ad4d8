"""What `init` writes: robot descriptions with the source of every number, and a closed-form sample."""
