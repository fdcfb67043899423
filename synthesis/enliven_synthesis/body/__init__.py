"""The made-up performer: proportions, kinematics, and a surface as a signed distance that rays meet."""
