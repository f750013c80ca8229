"""From a user's robot to a policy: tracking, fit, certificate, trainings, and swims on the robot as it was built."""
