"""Files of simulations: particles of LAMMPS, LIGGGHTS, YADE and MercuryDPM, and the forces between them."""
