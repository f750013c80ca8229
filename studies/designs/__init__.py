"""Which robot swims fastest: 100,000 designs of limbs, and where their mass belongs."""
