/* Prints what a policy commands by every observation, with what it remembers, from standard input. */
#include <stdio.h>
#include "policy.c"

static float observation[SEASTAR_SIZE], past[SEASTAR_PAST > 0 ? SEASTAR_PAST : 1][SEASTAR_SIZE];

int main(void)
{
    struct seastar robot;
    int action[SEASTAR_NUMBERS];
    float commands[SEASTAR_LIMBS];
    while (fread(observation, sizeof observation, 1, stdin) == 1) {
        seastar_begin(&robot);
        if (SEASTAR_PAST > 0 && fread(past, sizeof past, 1, stdin) == 1) {
            memcpy(robot.past, past, sizeof past);
            robot.begun = 1;
        }
        seastar_act(&robot, observation, action, commands);
        for (int limb = 0; limb < SEASTAR_LIMBS; limb++)
            printf("%g ", commands[limb]);
    }
    return 0;
}
