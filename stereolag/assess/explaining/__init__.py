"""Explanations of why a pixel was matched as it was, or left blank."""
