"""The articulated body model: capsules on 20 joints with 30 degrees of freedom, and the joint limits."""
