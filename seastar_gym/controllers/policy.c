/* Code of every policy. It allocates nothing and keeps nothing: what a policy remembers is in a struct of the caller. */

#include <math.h>
#include <string.h>

/* Memory of one robot. Call seastar_begin at the beginning of every episode. */
struct seastar {
    int begun;
    float past[SEASTAR_PAST > 0 ? SEASTAR_PAST : 1][SEASTAR_SIZE]; /* latest first */
};

void seastar_begin(struct seastar *robot)
{
    robot->begun = 0;
}

/* Vector (x, y) of a station from the hub, of points [m] or velocities [m/s]; see envs/stations.py. */
static void at_station(const double *points, int limb, int station, double *x, double *y)
{
    const double *of_limb = points + 2 * (1 + limb * SEASTAR_PER_LIMB);
    *x = *y = 0.0;
    for (int k = 0; k < SEASTAR_PER_LIMB; k++) {
        *x += station_weights[station][k] * (of_limb[2 * k] - points[0]);
        *y += station_weights[station][k] * (of_limb[2 * k + 1] - points[1]);
    }
}

/* Write the vector (x, y) as seen in a frame whose x axis is (c, s); returns the place of the next number. */
static float *write_turned(float *out, double x, double y, double c, double s, double unit)
{
    *out++ = (float)((x * c + y * s) / unit);
    *out++ = (float)((y * c - x * s) / unit);
    return out;
}

/* Direction (c, s) of the body's x axis: the rotation that fits the rest shape best to the stations. */
static void body_axis(const double *positions, double *c, double *s)
{
    *c = *s = 0.0;
    for (int limb = 0; limb < SEASTAR_LIMBS; limb++)
        for (int station = 0; station < SEASTAR_STATIONS; station++) {
            const double *rest = rest_stations[limb * SEASTAR_STATIONS + station];
            double x, y;
            at_station(positions, limb, station, &x, &y);
            *c += rest[0] * x + rest[1] * y;
            *s += rest[0] * y - rest[1] * x;
        }
    double norm = sqrt(*c * *c + *s * *s);
    *c = norm > 0.0 ? *c / norm : 1.0;
    *s = norm > 0.0 ? *s / norm : 0.0;
}

/* Write what stands behind the stations and the hub's velocity: numbers of the limbs and of the task, and waypoints. */
static void write_tail(float *out, const double *hub, double c, double s, const double *limbs, const double *further,
                       const double *targets)
{
    for (int k = 0; k < SEASTAR_LIMBS * SEASTAR_OF_LIMB; k++)
        *out++ = (float)limbs[k];
    for (int k = 0; k < SEASTAR_FURTHER; k++)
        *out++ = (float)further[k];
    for (int k = 0; k < 2; k++)
        out = write_turned(out, targets[2 * k] - hub[0], targets[2 * k + 1] - hub[1], c, s, SEASTAR_LIMB_LENGTH);
}

/* Observation of a robot whose velocities are known.

   positions, velocities: of the tracked points in the world frame [m], [m/s], [SEASTAR_POINTS][2]: the hub, then the
       points of limb 1 from hub to tip, those of limb 2, ...
   limbs: numbers of the limbs, [SEASTAR_LIMBS][SEASTAR_OF_LIMB]; NULL where SEASTAR_OF_LIMB is 0.
   further: further numbers of the task, [SEASTAR_FURTHER]; NULL where there are none.
   targets: the current and the next waypoint in the world frame [m], [2][2].
   observation: [SEASTAR_SIZE] */
void seastar_observe_moving(const double *positions, const double *velocities, const double *limbs,
                            const double *further, const double *targets, float *observation)
{
    float *out = observation;
    double c, s, x, y;
    body_axis(positions, &c, &s);
    if (SEASTAR_SHOWS_LIMBS) {
        for (int kind = 0; kind < 2; kind++)
            for (int limb = 0; limb < SEASTAR_LIMBS; limb++)
                for (int station = 0; station < SEASTAR_STATIONS; station++) {
                    at_station(kind == 0 ? positions : velocities, limb, station, &x, &y);
                    out = write_turned(out, x, y, c, s, kind == 0 ? SEASTAR_LIMB_LENGTH : SEASTAR_VELOCITY_SCALE);
                }
        out = write_turned(out, velocities[0], velocities[1], c, s, SEASTAR_VELOCITY_SCALE);
    }
    write_tail(out, positions, c, s, limbs, further, targets);
}

#if !SEASTAR_SHOWS_LIMBS
/* Observation of a policy that does not see its limbs, by a pose; other arguments as those of seastar_observe_moving.

   pose: place of the hub in the world frame [m] and direction of limb 1 at rest [rad], x, y, theta. */
void seastar_observe_pose(const double *pose, const double *limbs, const double *further, const double *targets,
                          float *observation)
{
    write_tail(observation, pose, cos(pose[2]), sin(pose[2]), limbs, further, targets);
}
#endif

/* Observation of a robot by its last positions; other arguments as those of seastar_observe_moving.

   history: n positions of the tracked points [m], [n][SEASTAR_POINTS][2], latest first.
   interval: time from one to the next [s]. Velocities are differences of second order of the last three, of first
       order of two, and zero of one. */
void seastar_observe(const double *history, int n, double interval, const double *limbs, const double *further,
                     const double *targets, float *observation)
{
    double velocities[2 * SEASTAR_POINTS];
    for (int k = 0; k < 2 * SEASTAR_POINTS; k++) {
        const double *now = history + k;
        double moved = 0.0;
        if (n > 2)
            moved = 1.5 * now[0] - 2.0 * now[2 * SEASTAR_POINTS] + 0.5 * now[4 * SEASTAR_POINTS];
        else if (n > 1)
            moved = now[0] - now[2 * SEASTAR_POINTS];
        velocities[k] = n > 1 ? moved / interval : 0.0;
    }
    seastar_observe_moving(history, velocities, limbs, further, targets, observation);
}

/* Whether n numbers are finite, and so small that the network can add them up. */
static int are_known(const float *numbers, int n)
{
    for (int k = 0; k < n; k++)
        if (!(fabsf(numbers[k]) <= (float)SEASTAR_LARGEST_SEEN))
            return 0;
    return 1;
}

/* Element of the symmetry group that brings the current waypoint into sector 0; see envs/symmetry. */
static int element_of(const float *observation)
{
    const float *targets = observation + SEASTAR_SIZE - 4;
    if (SEASTAR_ELEMENTS == 1 || !are_known(targets, 4))
        return 0;
    double ca = cos(SEASTAR_AXIS), sa = sin(SEASTAR_AXIS);
    double x = ca * targets[0] + sa * targets[1], y = ca * targets[1] - sa * targets[0];
    double next_x = ca * targets[2] + sa * targets[3], next_y = ca * targets[3] - sa * targets[2];
    double width = SEASTAR_SECTOR_WIDTH, angle = atan2(y, x), boundary = rint(angle / width);
    double sector = floor(angle / width);
    if (fabs(angle - boundary * width) <= SEASTAR_BOUNDARY_WIDTH) {
        double aside = cos(boundary * width) * next_y - sin(boundary * width) * next_x;
        sector = boundary - (aside < -SEASTAR_BOUNDARY_WIDTH * hypot(next_x, next_y));
    }
    int element = (SEASTAR_PER_SECTOR * (int)sector) % SEASTAR_ELEMENTS;
    return element < 0 ? element + SEASTAR_ELEMENTS : element;
}

/* Number `i` of an observation that an element turns and mirrors. */
static float carried(const float *observation, int element, int i)
{
    const struct term *terms = carry[element][i];
    return terms[0].factor * observation[terms[0].place] + terms[1].factor * observation[terms[1].place];
}

/* Logits of the network, [SEASTAR_OUTPUTS], for its input, [SEASTAR_INPUTS]. */
void seastar_logits(const float *input, float *logits)
{
    float buffers[2][SEASTAR_WIDEST];
    const float *from = input;
    for (int layer = 0; layer < SEASTAR_LAYERS; layer++) {
        int is_last = layer == SEASTAR_LAYERS - 1;
        float *to = is_last ? logits : buffers[layer % 2];
        for (int i = 0; i < layers[layer].outputs; i++) {
            const float *row = layers[layer].weight + i * layers[layer].inputs;
            float sum = layers[layer].bias[i];
            for (int j = 0; j < layers[layer].inputs; j++)
                sum += row[j] * from[j];
            to[i] = is_last ? sum : tanhf(sum);
        }
        from = to;
    }
}

/* What the network sees of an observation and of those before, [SEASTAR_INPUTS]; returns the element that turned it. */
int seastar_input(const struct seastar *robot, const float *observation, float *input)
{
    int element = element_of(observation);
    for (int i = 0; i < SEASTAR_SIZE; i++)
        *input++ = carried(observation, element, i);
    for (int k = 0; k < SEASTAR_PAST; k++)
        for (int i = 0; i < SEASTAR_TOLD; i++)
            *input++ = carried(robot->begun ? robot->past[k] : observation, element, told[i]);
    return element;
}

/* The most probable action for an observation; rest, action 0, if a number of it, or of one that the robot remembers, is
   NaN, infinite or beyond SEASTAR_LARGEST_SEEN.

   observation: [SEASTAR_SIZE]
   action: the environment's action, [SEASTAR_NUMBERS].
   commands: what it means, -1, 0 or 1 for every limb, [SEASTAR_LIMBS]. */
void seastar_act(struct seastar *robot, const float *observation, int *action, float *commands)
{
    float input[SEASTAR_INPUTS], logits[SEASTAR_OUTPUTS];
    int element = seastar_input(robot, observation, input);
    int known = are_known(observation, SEASTAR_SIZE)
                && (!robot->begun || are_known(robot->past[0], SEASTAR_PAST * SEASTAR_SIZE));
    seastar_logits(input, logits);
    for (int number = 0; number < SEASTAR_NUMBERS; number++) {
        const float *of_number = logits + number * SEASTAR_CHOICES;
        int best = 0;
        for (int k = 1; known && k < SEASTAR_CHOICES; k++)
            if (of_number[k] > of_number[best])
                best = k;
        action[restored_place[element][number]] = restored[element][best];
    }
    for (int limb = 0; limb < SEASTAR_LIMBS; limb++)
        commands[limb] = SEASTAR_NUMBERS > 1 ? commands_of[action[limb]][0] : commands_of[action[0]][limb];
    for (int k = SEASTAR_PAST - 1; k >= 0; k--) {
        const float *before = k > 0 && robot->begun ? robot->past[k - 1] : observation;
        memcpy(robot->past[k], before, sizeof robot->past[k]);
    }
    robot->begun = 1;
}
