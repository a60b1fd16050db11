"""Training of insonify's generators: {image, mask, segmentation, attenuation} -> high-quality image."""

import os

# Threads that spin while they wait make a step ten times slower on cores with other work. Read when torch is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
