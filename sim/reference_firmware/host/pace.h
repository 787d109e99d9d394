/* Motor time of the host build. Speed 0: only requests move it, a window read as far as the window needs. */
#ifndef PACE_H
#define PACE_H

#include "cm_drive.h"

void pace_start(double speed);
/* At speed N: let motor time catch up with the wall. Always: the firmware's background work. */
void pace_keep(cm_drive *drive);
/* The motor time that a request takes; `reads_window`: registers of a window read, else 0. */
void pace_request(cm_drive *drive, uint16_t reads_window);

#endif
