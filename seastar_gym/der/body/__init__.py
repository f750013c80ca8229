"""A body between the limbs: a rigid hub with a size, its inertia, drag and weight. Only scenes with one need it."""
