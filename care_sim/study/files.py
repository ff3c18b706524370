"""Files of studies are there whole or not at all."""

from care_sim.files import replacing as replacing
