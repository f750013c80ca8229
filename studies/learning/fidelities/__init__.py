"""Does the fidelity that a policy is trained at matter to how it swims? A matrix of trainings and swims."""
