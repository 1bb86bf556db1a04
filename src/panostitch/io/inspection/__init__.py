"""What a picture file holds, in bounded memory: its header first, and of the pixels a piece at a time."""

from panostitch.io.inspection.border import Border as Border
from panostitch.io.inspection.picture import Picture as Picture
from panostitch.io.inspection.picture import inspect_picture as inspect_picture
