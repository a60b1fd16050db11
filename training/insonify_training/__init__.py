"""Training of insonify's generators: {image, mask, segmentation, attenuation} -> high-quality image."""
