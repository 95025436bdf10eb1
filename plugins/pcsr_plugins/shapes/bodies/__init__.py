"""Families of smooth bodies: fields whose zero level is the surface, negative inside. Lengths are millimetres."""
