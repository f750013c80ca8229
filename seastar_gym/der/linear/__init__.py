"""The linear system of a Newton step: a star of chains, eliminated limb by limb."""
