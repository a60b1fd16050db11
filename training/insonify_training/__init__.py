"""Trains insonify's generators: G: {image, mask, segmentation, attenuation} -> high-quality image."""
