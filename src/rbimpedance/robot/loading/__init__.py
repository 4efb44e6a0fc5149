"""What `load_robot` does before Pinocchio: find the source, read it strictly, choose joints, and check the result."""
