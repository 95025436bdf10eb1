"""Reading of ROS bags, by rosbags (extra `[ros]`): topics, messages, clouds, images and transforms."""
