"""What a run tells while it goes on and leaves behind for others to look at: metrics, evaluations, pictures, 3D."""
