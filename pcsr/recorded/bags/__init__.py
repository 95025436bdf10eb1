"""Import of touches from ROS bags: which messages are touches, what they touched, and where the sensor was."""
