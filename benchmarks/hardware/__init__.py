"""Robots: laws on servers that speak a robot's protocol, and laws whose ticks come late or not at all."""
