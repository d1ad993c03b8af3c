"""Design by requirement: the cheapest formation that a search finds for a brief.

candidates        a formation as numbers between 0 and 1: its scenario, its faults, its error
cell_search       the best formation of so many vehicles and landmarks
impossibility     proofs that no formation can meet a brief
purchases         changes of a brief that may help
ladder            all searches of a design, and the front that they find
judgement         a formation refined, predicted, flown and validated
designer          the design itself: the cheapest team that meets its brief, or what would help
"""
