"""Planar discrete elastic rods: numbers in, numbers out; no robot, no clock.

In come coefficients, places and velocities of a group of robots, as rows; out come those at the end of an interval,
with a report. A time step is a minimisation (newton.py) of a potential that terms add up to (potential.py, terms/),
under a guard, because plain Newton steps fail at the extremes and the midpoint rule may pump energy (guard.py).

symbol         name             unit    what it is, and the chapter's equation
q              q                m       coordinates of all nodes (13.1)
v              v                m/s     their velocities
e              ex, ey           m       edge vector
|e|, l         length, l        m       length of an edge, its natural length
u              ux, uy           1/m     e/|e|^2; grad theta = (-u_y, u_x)
theta          theta            rad     direction of an edge
T              T                N       tension EA (|e|/l - 1), from (13.2)
phi            phi              rad     angle of a hinge, from its first edge to its second (13.4)
psi            psi              rad     opening angle of a hub hinge, Fig. 13.4b
t              t                1       tan(phi/2)
kappa          kappa            1/m     curvature 2 t/dl of a hinge (13.3)
kappa_bar      kappa_bar        1/m     natural curvature
delta_psi      delta_psi        rad     rotation of a limb by its actuator, Fig. 13.5b
dl             dl               m       Voronoi length
E, A, I        EA, EI           N, N m2 Young's modulus, area, second moment of area
C_d            c                kg/m    drag 1/2 rho_f C_d D dl of a node (13.8)
M              m, mass          kg      lumped masses
g, d           g, d             m       gap between a node and an edge of another limb, and where they touch; contact/
h, gamma       h, gamma         s       time step; coefficient of a stage times h
Phi            phi, energy      J       incremental potential of a stage, see potential.py

Entry points call the machine code of kernels. What Python calls itself, `drag_slopes(c, wx, wy)`, runs in Python. What
kernels may ask of a processor is listed in plain.py. NUMBA_DISABLE_JIT=1 runs everything so, in any debugger,
thousands of times slower.

Work of a Newton iteration of the chapter's discretisation (46 nodes), counted by studies/operations.py; shares of
the time are those of an AVX-512 processor, by `python -m studies.speed.throughput` at commit 055100c4:

part            kflop   time    what
hub hinges       0.2     3 %    root edges, five hinges, their couplings (potential.py)
limbs            9.5    80 %    assembly and elimination in one sweep, 211 flop per node (potential.py, linear.py)
ring             0.8     8 %    elimination of root nodes and hub (linear.py)
substitution     1.0     9 %    back through the limbs, and the Newton step (linear.py, newton.py)

In the continuum's discretisation limbs take 11.8 kflop, because the middles of edges have drag and inertia too, the hub
0.7 instead of the ring, 13.7 in all.

A node of a limb takes 58 products, 52 fused products, 42 sums, 4.6 divisions and 1.9 roots. The sweep runs
at half the peak of fused products; it is bound by the number of instructions (twice the lanes take twice the time,
half the lanes save a tenth), not by the divider (a quarter busy), nor by the chain of pivots. What is left: fewer
products in the edge Hessians and couplings, and fewer iterations (1.3 per step of 3 ms, where one is the least).
"""
