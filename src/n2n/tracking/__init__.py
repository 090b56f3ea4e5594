"""What a fit tells about itself: metrics, pictures, clouds."""
