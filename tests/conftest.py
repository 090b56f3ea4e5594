"""One torch thread: small tensors gain nothing from more, and on a busy machine waiting for them takes seconds."""

import torch

torch.set_num_threads(1)
