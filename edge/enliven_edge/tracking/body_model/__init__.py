"""The articulated body that is fitted: capsules on 20 joints with 30 degrees of freedom, and their limits."""
