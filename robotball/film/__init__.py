"""Motions as moving pictures, without a screen."""
