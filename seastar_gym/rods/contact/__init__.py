"""Contact of limbs with each other and with a body, from who is near whom to the linear system that it couples."""
